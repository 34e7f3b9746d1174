"""The step of a run, found by error control, and the integration error that is left."""
