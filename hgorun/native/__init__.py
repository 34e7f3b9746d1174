"""Machine code: LLVM IR as text, its compiler, and elementary functions with the same bits on every processor."""
