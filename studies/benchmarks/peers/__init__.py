"""Motions as nonlinear programs in CasADi, solved by IPOPT and FATROP, compiled if there is a compiler."""
