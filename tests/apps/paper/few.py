"""The settings of a report of a few flights."""

FEW = [
    *("task=figures", "figures.episodes=20", "figures.checked_episodes=8", "figures.prediction_episodes=3"),
    *("figures.clusterings=2", "figures.shuffles=2", "figures.resamples=20"),
    *("predictor.processes=1", "predictor.futures=2"),
]
