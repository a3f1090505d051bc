"""Messages in simulation: both converters in a loop behind the Manager, judged by serialisers that are not ours."""
