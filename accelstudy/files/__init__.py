"""Files written whole or not at all, tables with provenance, YAML with errors that name the key."""
