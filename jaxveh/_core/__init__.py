"""What every room shares: recordings, names, chosen parameters, bijectors, result codes, errors."""
