"""The configuration: YAML with line numbers, expressions, and the blocks as models."""
