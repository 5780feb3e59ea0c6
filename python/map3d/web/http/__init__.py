"""What all routes use: access, cookies, settings, statuses, compression, caches, public URLs, health, open tile stores."""
