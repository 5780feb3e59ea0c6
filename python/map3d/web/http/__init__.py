"""What all routes use: tables of routes, the current request, bodies, responses, headers, errors, access, settings, open tile stores."""
