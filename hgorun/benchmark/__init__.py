"""A benchmark: observers tuned alike on several plants under several conditions, and scored on seeds not seen."""
