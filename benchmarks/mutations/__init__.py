"""Mutations at random: does a test fail when one operator, sign, constant or argument of the physics is wrong?"""
