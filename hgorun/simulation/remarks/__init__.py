"""What should be known of a run although nothing is wrong: units, gains, measurements that reach nobody."""
