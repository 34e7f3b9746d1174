"""The metrics of runs, in machine code where they are built in: of one run, a long one, or many side by side."""
