"""Where the loop's runs are worked on: in this process, in a pool of processes, or on a Dask cluster."""
