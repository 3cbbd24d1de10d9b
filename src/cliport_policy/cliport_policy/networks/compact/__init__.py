"""Compact network: locator, rotator and transport of small U-Nets behind one goal reader."""
