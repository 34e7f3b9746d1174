"""Where observers start: from the first samples, or where the model passes nearest to several."""
