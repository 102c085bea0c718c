"""Sends positions live to a chip with the `stream` engine, or to any servo controller that speaks Mini
SSC.
"""
