"""Views from anywhere in a light field, made of the nearest of its views and their depth."""
