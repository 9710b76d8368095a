"""What a dataset is: its configuration, its keys, its records."""
