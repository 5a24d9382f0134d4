//! The reinforcement-learning environment: observation, action, reward, episodes.
