"""Designs: the input of the user.

In: a TOML file, changes of keys, kits and drawings. Out: a ``Design``, frozen and validated, whose
sections are the settings of every later stage; or a ``DesignError`` with one sentence.
"""
