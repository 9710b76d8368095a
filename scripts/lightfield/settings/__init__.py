"""What all settings in YAML share: models, types, safe reading, and mistakes in one line."""
