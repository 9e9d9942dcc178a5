"""Fleets: the URC servers of many places, their network and their certificates.

Layer 4. A *site* is a URC server with its robots. The engine, guard, lease and latch of a
robot stay at its site; the network of the fleet only carries bytes between sites.
"""
