"""The files of bags: MCAP, SQLite and ROS 1, read record by record and compared with what each says about itself."""
