"""What can be refused of a prepared run before its first step."""
