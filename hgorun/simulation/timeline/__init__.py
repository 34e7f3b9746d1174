"""When everything happens in a run: output points, events, the steps in between, and the engine's tables of them."""
