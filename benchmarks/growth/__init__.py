"""What long recordings cost: seconds of processors and memory of a loop, in processes of their own."""
