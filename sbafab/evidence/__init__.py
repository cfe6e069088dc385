"""Measured curves as data, each with its source, set-up and error: the papers', and a lab's."""
