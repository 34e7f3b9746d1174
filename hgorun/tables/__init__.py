"""Tables for people and papers: text, CSV, LaTeX."""
