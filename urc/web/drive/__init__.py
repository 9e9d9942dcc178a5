"""Control of a robot by pages: leases, held commands, other commands, STOP and confirmations."""
