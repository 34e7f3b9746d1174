"""Plants and observers as symbolic expressions: matrices of the field, canonical forms, the whole system."""
