"""Control of a robot from pages: leases, held commands, commands, STOP and confirmations."""
