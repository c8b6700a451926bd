"""What the contract is checked on: for every public name valid calls, from which the bad ones are made."""


class Call:
    """A valid call: a function, or `on` (a fresh object and its method's name), and its arguments, kinds of `bad_inputs`."""

    def __init__(self, function, /, **arguments):
        self.function, self.arguments = function, arguments

    def prepared(self):
        """The object whose state a refused call must not change, or None, and the function to call."""
        if isinstance(self.function, on):
            owner = self.function.make()
            return owner, getattr(owner, self.function.name)
        return None, self.function

    def valid(self):
        return {name: kind.value for name, kind in self.arguments.items()}

    def bad(self):
        """(argument, what is bad about it, value) of every call that must be refused."""
        for name, kind in self.arguments.items():
            for what, value in kind.bad():
                yield name, what, value


class on:
    """A method of an object that is made anew for each call."""

    def __init__(self, make, name):
        self.make, self.name = make, name
