"""The page in a browser: `swingid dashboard`, on a log file or beside a live rig (extra `app`)."""
