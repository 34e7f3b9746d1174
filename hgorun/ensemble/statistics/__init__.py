"""What is said of many members: means and quantiles, times that never come, points and fronts."""
