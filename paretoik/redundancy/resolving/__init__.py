"""One motion by its velocities, step by step: the classical resolvers and Wan's weighted gradient projection."""
