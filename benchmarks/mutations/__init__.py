"""Random mutations: whether a test fails if one operator, sign, constant or argument of the physics is wrong."""
