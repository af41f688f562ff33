"""What our sensors do that accelstudy does not know."""
