"""Control of robots by people: leases, live pages, reports, and the REST API."""
