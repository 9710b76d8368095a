"""The typed configuration: config.yaml, scene YAMLs, and the settings that follow from them."""
