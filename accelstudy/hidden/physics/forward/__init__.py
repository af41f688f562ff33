"""Forward physics: sessions, rigs, sensors, effects and noise."""
