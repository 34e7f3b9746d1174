"""Numbers that say how good an estimate is: one record each."""
