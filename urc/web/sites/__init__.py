"""Robots of other sites on this dashboard, and visitors from other sites at this server.

Layer 5. Pages are made here from the robot's document, so another site cannot put scripts into a
page. Sockets and API calls are passed to the robot's site over lines of the fleet.
"""
