"""Plants as symbolic expressions, the matrices of the field, and the forms that observers ask for."""
