"""Steps of builds as actions: a step whose inputs, tools and environment are unchanged is answered from a store."""
