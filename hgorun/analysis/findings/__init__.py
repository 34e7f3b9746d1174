"""What an analysis says of an observer: a file for every group of findings, a function for every finding."""
