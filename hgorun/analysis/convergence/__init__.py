"""Gains, Lipschitz constants, and what the theorems promise of convergence and peaking."""
