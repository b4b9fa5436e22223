"""Programs in an editor: findings while typing, fixes, hover, labels, completion, layout."""
