"""The accuracy of sideslip estimates, on real logs and on a fleet of simulated cars."""
