"""Plants and observers from and for other packages of control engineers."""
