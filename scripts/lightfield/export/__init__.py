"""What exporters share: the views and surfaces that they read, points, cameras and pictures."""
