"""How good schemes are, and how sessions stop: the studies behind the guides of positions."""
