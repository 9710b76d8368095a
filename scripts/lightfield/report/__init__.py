"""The pages, pictures and tables that show a dataset."""
