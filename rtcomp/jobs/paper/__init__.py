"""The paper's figures and the claims of its text, made anew and tested (`rtcomp paper`)."""
