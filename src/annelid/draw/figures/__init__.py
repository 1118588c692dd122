"""The paper's figures drawn anew, one module each."""
