"""The files of a dataset that others read: lightfield.json, passes, splits, inventories, layout."""
