"""How well sideslip is estimated, on real logs and on a fleet of simulated cars."""
