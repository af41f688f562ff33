"""Files: written whole or not at all, tables with their origin, YAML whose errors name the key."""
