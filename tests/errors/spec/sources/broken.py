def broken(message)
    return message
