"""The file of a result: its parts, written at once or while the run goes on."""
