"""Networks on chip for topics within the FPGA: topologies, routes, mapping of endpoints, a cycle model, hardware."""
