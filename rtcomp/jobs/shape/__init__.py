"""Which shape a model has and where its intervals lie: chosen by what pays on motion held out."""
