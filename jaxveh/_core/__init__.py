"""The base of all subpackages: recordings, names, chosen parameters, bijectors, result codes, errors."""
